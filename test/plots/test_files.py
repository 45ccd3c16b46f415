# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`rigid_sim plot` as a user runs it: files, read again, and one line where it cannot be."""
from html.parser import HTMLParser
import json
import re
import shutil
import subprocess
from xml.etree import ElementTree

from bag import sessions
import fresh
import numpy as np
from PIL import Image
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

from rigid_sim_ros import cli
from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.bag.motion import read_motion
from rigid_sim_ros.plots.diagram import COLORS, Diagram, Line, Panel
from rigid_sim_ros.plots.page import write_page
from rigid_sim_ros.plots.panels import QUANTITIES
from rigid_sim_ros.plots.picture import write_picture

STORE = get_typestore(Stores.ROS2_JAZZY)
T = STORE.types
DATE_NS = 1_700_000_000_000_000_000
TITLES = ['Position, x', 'Position, y', 'Position, z', 'Path', 'Speed', 'Angular speed',
          'Energy', 'Momentum', 'Angular momentum about the origin']
UNITS = ['[m]', '[m/s]', '[rad/s]', '[J]', '[kg m/s]', '[kg m\u00b2/s]',
         'simulated time, resets not counted back [s]']


def run(capsys, *words):
    """Run the command line and return exit code, stdout and stderr."""
    with pytest.raises(SystemExit) as left:
        cli.main([str(word) for word in words])
    captured = capsys.readouterr()
    return left.value.code, captured.out, captured.err


def plot(capsys, output, bag=None, *words):
    code, out, err = run(
        capsys, 'plot', bag or sessions.shared_session(), '--output', output, *words)
    assert (code, err) == (0, '')
    return out


def test_a_png_shows_lines_in_the_colours_of_the_bodies(tmp_path, capsys):
    out = plot(capsys, tmp_path / 'a.png')
    assert f'{tmp_path / "a.png"}: 9 panels, scene: 2 bodies, 0 to 3.5 s' in out
    with Image.open(tmp_path / 'a.png') as image:
        pixels = np.asarray(image.convert('RGB')).reshape(-1, 3)
        assert image.format == 'PNG'
        assert image.width > 1200
        assert image.height > 800
    for color in ((0x00, 0x72, 0xB2), (0xE6, 0x9F, 0x00)):
        assert (pixels == color).all(axis=1).sum() > 1000
    assert (pixels == 255).all(axis=1).mean() > 0.7


def panels_of_contacts():
    """Return a panel of an impact that lasts for one state, and one of all the time."""
    at = np.linspace(0.0, 2.0, 21)
    gap = np.where(np.arange(21) == 5, 0.0, np.nan)
    return Diagram('', 'time [s]', [
        Panel('Gap', 'mm', [Line('', at, gap, COLORS[3])]),
        Panel('Height', 'm', [Line('', at, at, COLORS[0])]),
        Panel('Depth', 'm', [Line('', at, -at, COLORS[2])])], [])


def test_what_lasts_for_one_state_is_seen_at_its_time(tmp_path):
    write_picture(panels_of_contacts(), tmp_path / 'a.png')
    with Image.open(tmp_path / 'a.png') as image:
        pixels = np.asarray(image.convert('RGB')).astype(int)
    columns = [np.flatnonzero((abs(pixels - color) < 12).all(axis=2).any(axis=0))
               for color in ((0xD5, 0x5E, 0x00), (0x00, 0x72, 0xB2))]
    assert len(columns[0]) >= 3
    # One panel stands below the other, and both have the same time axis: 0.5 of 0 to 2 s.
    start, end = columns[1].min(), columns[1].max()
    assert columns[0].mean() == pytest.approx(start + 0.25 * (end - start), abs=3)     # px


def test_a_page_shows_what_lasts_for_one_state(tmp_path):
    write_page(panels_of_contacts(), tmp_path / 'a.html')
    (dot, line, _), _, _ = figure_of(tmp_path / 'a.html')
    assert 'markers' in dot['mode']
    assert line['mode'] == 'lines'


def test_an_svg_holds_its_labels_as_text_with_units(tmp_path, capsys):
    plot(capsys, tmp_path / 'a.svg')
    tree = ElementTree.parse(tmp_path / 'a.svg')
    texts = [''.join(node.itertext()) for node in tree.iter('{http://www.w3.org/2000/svg}text')]
    assert set(TITLES) <= set(texts)
    assert set(UNITS) <= set(texts)
    assert {'crate', 'ball', 'kinetic, rotational', 'potential', 'total'} <= set(texts)


def test_the_same_bag_gives_the_same_picture(tmp_path, capsys):
    for name in ('a.svg', 'b.svg'):
        plot(capsys, tmp_path / name, None, '--duration', '0.5')
    assert (tmp_path / 'a.svg').read_bytes() == (tmp_path / 'b.svg').read_bytes()


class Scripts(HTMLParser):
    """Gathers the scripts of a page and what they are loaded from."""

    def __init__(self):
        super().__init__()
        self.sources, self.texts, self._inside = [], [], False

    def handle_starttag(self, tag, attributes):
        self._inside = tag == 'script'
        self.sources += [value for key, value in attributes
                         if key in ('src', 'href') and value]

    def handle_endtag(self, tag):
        self._inside = False

    def handle_data(self, data):
        if self._inside:
            self.texts.append(data)


def figure_of(path):
    """Return traces and layout that a page hands to plotly, and where it loads from."""
    scripts = Scripts()
    scripts.feed(path.read_text(encoding='utf-8'))
    # The call names the element; in plotly's own code it does not.
    rest, = (text[found.end() - 1:] for text in scripts.texts
             for found in re.finditer(r'Plotly\.newPlot\(\s*"', text))
    decoder = json.JSONDecoder()
    found = []
    while len(found) < 3:       # the id of the element, the traces, the layout
        rest = rest.lstrip(' \n,')
        value, end = decoder.raw_decode(rest)
        found.append(value)
        rest = rest[end:]
    return found[1], found[2], scripts.sources


def test_a_page_holds_everything_that_it_needs(tmp_path, capsys):
    plot(capsys, tmp_path / 'a.html')
    traces, layout, sources = figure_of(tmp_path / 'a.html')
    assert sources == []
    assert {note['text'] for note in layout['annotations']} >= set(TITLES)
    assert {axis['title']['text'] for name, axis in layout.items()
            if re.match('[xy]axis', name) and 'title' in axis} >= set(UNITS)
    assert [trace['name'] for trace in traces[:2]] == ['crate', 'ball']


def test_the_time_axes_of_a_page_are_linked_and_that_of_the_path_is_not(tmp_path, capsys):
    plot(capsys, tmp_path / 'a.html')
    _, layout, _ = figure_of(tmp_path / 'a.html')
    axes = [axis for name, axis in layout.items() if name.startswith('xaxis')]
    assert sum(axis.get('matches') == 'x' for axis in axes) == len(TITLES) - 2
    path, = (axis for axis in axes if axis.get('title', {}).get('text') == 'x [m]')
    assert 'matches' not in path


@pytest.mark.skipif(shutil.which('chromium') is None, reason='chromium is not installed')
def test_a_browser_without_a_network_draws_the_page(tmp_path, capsys):
    plot(capsys, tmp_path / 'a.html')
    dom = subprocess.run(
        [shutil.which('chromium'), '--headless', '--no-sandbox', '--disable-gpu',
         f'--user-data-dir={tmp_path / "profile"}', '--host-resolver-rules=MAP * ~NOTFOUND',
         '--virtual-time-budget=20000', '--dump-dom', (tmp_path / 'a.html').as_uri()],
        capture_output=True, text=True, check=True, timeout=300).stdout
    # Two bodies in six panels, energy with its four lines, two momenta with three each.
    assert len(re.findall('class="trace scatter', dom)) == 2 * 6 + 4 + 2 * 3


def test_every_quantity_stands_in_the_help(capsys):
    _, out, _ = run(capsys, 'plot', '--help')
    words = set(re.findall(r'[a-z_]+', out))
    assert words >= QUANTITIES.keys()


def test_chosen_quantities_are_drawn_and_no_others(tmp_path, capsys):
    out = plot(capsys, tmp_path / 'a.svg', None, '--quantity', 'energy', '--quantity', 'path')
    assert ': 2 panels, ' in out
    text = (tmp_path / 'a.svg').read_text(encoding='utf-8')
    assert 'Energy' in text
    assert 'Momentum' not in text


# --- bags of others -----------------------------------------------------------------------------


def header(k):
    t_ns = DATE_NS + k * 100_000_000
    return T['std_msgs/msg/Header'](
        stamp=T['builtin_interfaces/msg/Time'](sec=t_ns // 10**9, nanosec=t_ns % 10**9),
        frame_id='map')


def vector(x, y, z, kind='Vector3'):
    return T[f'geometry_msgs/msg/{kind}'](x=x, y=y, z=z)


def pose(x, q=(0.0, 0.0, 0.0, 1.0)):
    return T['geometry_msgs/msg/Pose'](
        position=vector(x, 0.0, 0.0, 'Point'),
        orientation=T['geometry_msgs/msg/Quaternion'](**dict(zip('xyzw', q, strict=True))))


def twist(x, w=0.0):
    return T['geometry_msgs/msg/Twist'](linear=vector(x, 0.0, 0.0), angular=vector(0.0, 0.0, w))


def odometry(k):
    quarter = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))      # its x axis is the map's y axis
    return T['nav_msgs/msg/Odometry'](
        header=header(k), child_frame_id='base',
        pose=T['geometry_msgs/msg/PoseWithCovariance'](
            pose=pose(0.5 * k, quarter), covariance=np.zeros(36)),
        twist=T['geometry_msgs/msg/TwistWithCovariance'](
            twist=twist(2.0), covariance=np.zeros(36)))


FOREIGN = {
    '/robot/pose': ('geometry_msgs/msg/PoseStamped', lambda k: T[
        'geometry_msgs/msg/PoseStamped'](header=header(k), pose=pose(float(k)))),
    '/robot/twist': ('geometry_msgs/msg/TwistStamped', lambda k: T[
        'geometry_msgs/msg/TwistStamped'](header=header(k), twist=twist(10.0, 0.25))),
    '/drone/odom': ('nav_msgs/msg/Odometry', odometry),
    '/robot/contact_wrench': ('geometry_msgs/msg/WrenchStamped', lambda k: T[
        'geometry_msgs/msg/WrenchStamped'](header=header(k), wrench=T['geometry_msgs/msg/Wrench'](
            force=vector(3.0, 0.0, 4.0), torque=vector(0.0, 0.0, 0.0)))),
}


@pytest.fixture
def foreign(tmp_path):
    """Return a bag that knows nothing of scenes, stamped with dates."""
    bag = tmp_path / 'foreign'
    with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, (kind, make) in FOREIGN.items():
            connection = writer.add_connection(topic, kind, typestore=STORE)
            for k in range(11):
                writer.write(connection, DATE_NS + k, bytes(STORE.serialize_cdr(make(k), kind)))
    return bag


def test_a_bag_without_a_scene_shows_poses_and_twists_and_says_what_it_cannot(
        foreign, tmp_path, capsys):
    out = plot(capsys, tmp_path / 'a.svg', foreign)
    assert 'foreign: 2 bodies, 0 to 1 s' in out
    for quantity in ('energy', 'momentum', 'angular momentum'):
        assert f'note: no {quantity}: the bag has no scene with masses\n' in out
    assert ('note: no gap: only sessions that rigid_sim_ros recorded can be simulated again for it'
            in out)
    text = (tmp_path / 'a.svg').read_text(encoding='utf-8')
    assert 'time since the first message [s]' in text
    assert {'robot', 'drone'} <= set(re.findall('>([^<]*)</text>', text))


def test_poses_and_twists_of_another_bag_are_those_of_its_messages(foreign):
    motion = read_motion(foreign)
    robot, drone = motion.names.index('robot'), motion.names.index('drone')
    assert motion.time == pytest.approx(np.arange(11) / 10)
    assert motion.position[:, robot, 0] == pytest.approx(np.arange(11))
    assert motion.linear_velocity[:, robot] == pytest.approx(np.tile([10.0, 0, 0], (11, 1)))
    assert motion.angular_velocity[:, robot, 2] == pytest.approx(np.full(11, 0.25))
    assert motion.position[:, drone, 0] == pytest.approx(0.5 * np.arange(11))
    # The twist of an Odometry has the axes of its child frame.
    assert motion.linear_velocity[:, drone] == pytest.approx(np.tile([0, 2.0, 0], (11, 1)))


def test_contact_wrenches_that_were_published_are_shown(foreign, tmp_path, capsys):
    plot(capsys, tmp_path / 'a.html', foreign, '--quantity', 'contact_force')
    traces, _, _ = figure_of(tmp_path / 'a.html')
    assert [trace['name'] for trace in traces] == ['robot']
    assert all(value == 5.0 for value in np.ravel(_numbers(traces[0]['y'])))


def _numbers(data):
    """Return the numbers of a trace, which plotly may write as base64."""
    if isinstance(data, list):
        return data
    import base64
    return np.frombuffer(base64.b64decode(data['bdata']), data['dtype'])


def test_a_state_and_a_scene_without_a_session_are_enough_for_energy(tmp_path, capsys):
    ours = {kinds.SESSION, kinds.SNAPSHOT, kinds.EVENT, kinds.STEP}
    other = sessions.rewrite(sessions.shared_session(), tmp_path,
                             lambda topic, data: None if topic.kind in ours else data)
    out = plot(capsys, tmp_path / 'a.svg', other)
    assert out.startswith('note: no gap: only sessions that rigid_sim_ros recorded')
    text = (tmp_path / 'a.svg').read_text(encoding='utf-8')
    assert {'potential', 'kinetic, rotational'} <= set(re.findall('>([^<]*)</text>', text))


# --- mistakes -----------------------------------------------------------------------------------


@pytest.mark.parametrize('words, mend', [
    (['--output', 'a.jpg'], '--output a.jpg, must end in .png, .svg, .html'),
    (['--output', 'no/a.png'], 'no/a.png: No such file or directory'),
    (['--output', 'a.png', '--bodies', 'crat'], "--bodies 'crat' matches no body"),
    (['--output', 'a.png', '--quantity', 'energi'], "--quantity energi: did you mean 'energy'?"),
    (['--output', 'a.png', '--start', '60'], 'the bag holds nothing from there on'),
    (['--output', 'a.png', '--duration', '-1'], 'must be > 0'),
    (['--output', 'a.png', '--quantity', 'gap'], 'nothing to plot: no gap'),
], ids=str)
def test_a_mistake_is_one_line_and_exit_code_2(words, mend, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, 'plot', sessions.shared_session(), *words)
    assert (code, out, err.count('\n')) == (2, '', 1)
    assert mend in err


@pytest.mark.parametrize('output, library', [('a.png', 'matplotlib'), ('a.html', 'plotly')])
def test_a_missing_library_is_named_with_what_brings_it(output, library, tmp_path):
    code = f"""
import sys
sys.modules['{library}'] = None
from rigid_sim_ros.cli import main
main(['plot', '{sessions.shared_session()}', '--output', '{tmp_path / output}'])
"""
    result = fresh.run('-c', code)
    assert result.returncode == 2
    assert result.stderr.count('\n') == 1
    assert "`pip install 'rigid_sim_ros[plot]'`" in result.stderr

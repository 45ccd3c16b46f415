# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who may reach the page: real requests to a real server."""
from collections.abc import Iterator
import contextlib
import gzip
import http.client
from importlib.util import find_spec
import socket
from unittest import SkipTest

if find_spec('viser') is None:
    raise SkipTest('viser is not installed: pip install .[view]')

import msgspec
import pytest
import viser
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from rigid_sim_ros.viewer.address import AddressError, open_page
from rigid_sim_ros.viewer.server import is_local, start, stop

TOKEN = 'secret-token'
PROTOCOL = f'viser-v{viser.__version__}'


@pytest.fixture(scope='module')
def guarded() -> Iterator[int]:
    """Give the port of a page with a token."""
    server = start('127.0.0.1', 0, TOKEN)
    yield server.get_port()
    stop(server)


@pytest.fixture(scope='module')
def local() -> Iterator[int]:
    """Give the port of a page for this machine."""
    server = start('127.0.0.1', 0)
    yield server.get_port()
    stop(server)


def get(port: int, path: str = '/', **headers: str) -> tuple[int, bytes, dict[str, str]]:
    """Return status, content and headers of an answer."""
    connection = http.client.HTTPConnection('127.0.0.1', port, timeout=60)
    connection.request('GET', path, headers=headers)
    response = connection.getresponse()
    content = response.read()
    connection.close()
    return response.status, content, dict(response.headers)


def opens_websocket(port: int, **headers: str) -> bool:
    try:
        with connect(f'ws://127.0.0.1:{port}', subprotocols=[PROTOCOL],
                     additional_headers=headers, open_timeout=60):
            return True
    except InvalidStatus as error:
        assert error.response.status_code == 403
        assert not error.response.body
        return False


def cookie(port: int) -> str:
    _, _, headers = get(port, f'/?token={TOKEN}')
    return headers['Set-Cookie'].partition(';')[0]


@pytest.mark.parametrize('path', [
    '/', '/index.html', '/?token=', '/?token=wrong', '/?x=1', '/drawing.js', '/culling.js',
    '/hover.js', '/hover?page=0&x=0.5&y=0.5'])
def test_without_the_token_there_is_nothing(guarded: int, path: str) -> None:
    status, content, _ = get(guarded, path)
    assert (status, content) == (403, b'')


def test_without_the_token_no_websocket_opens(guarded: int) -> None:
    assert not opens_websocket(guarded)


def test_the_token_opens_the_page_and_the_websocket(guarded: int) -> None:
    status, _, headers = get(guarded, f'/?token={TOKEN}')
    assert (status, headers['Location']) == (303, '/')
    mine = cookie(guarded)
    status, content, _ = get(guarded, Cookie=mine)
    assert status == 200
    assert b'<html' in content
    assert opens_websocket(guarded, Cookie=mine)


def test_the_page_brings_scripts_of_its_own(local: int) -> None:
    names = 'drawing', 'culling', 'hover', 'title'
    tags = ''.join(f'<script src="{name}.js"></script>' for name in names).encode() + b'</body>'
    for encoding, unpack in (('identity', bytes), ('gzip', gzip.decompress)):
        status, content, headers = get(local, **{'Accept-Encoding': encoding})
        assert (status, headers['Content-Encoding']) == (200, encoding)
        assert unpack(content).count(tags) == 1
    for name in names:
        status, content, headers = get(local, f'/{name}.js')
        assert status == 200
        assert headers['Content-Type'].startswith('text/javascript')
        assert b"'use strict'" in content


@pytest.mark.parametrize('query', ['', '?page=0', '?page=a&x=0&y=0', '?page=0&x=0&y='])
def test_a_question_without_a_place_is_refused(local: int, query: str) -> None:
    assert get(local, f'/hover{query}')[:2] == (403, b'')


def test_scripts_of_the_page_cannot_read_the_token(guarded: int) -> None:
    _, _, headers = get(guarded, f'/?token={TOKEN}')
    assert 'HttpOnly' in headers['Set-Cookie']


def test_a_wrong_cookie_opens_nothing(guarded: int) -> None:
    name = cookie(guarded).partition('=')[0]
    assert get(guarded, Cookie=f'{name}=wrong')[0] == 403


def test_another_site_cannot_open_a_websocket_with_the_users_cookie(guarded: int) -> None:
    assert not opens_websocket(guarded, Cookie=cookie(guarded), Origin='http://elsewhere.example')


def test_a_local_page_needs_no_token(local: int) -> None:
    assert get(local)[0] == 200
    assert opens_websocket(local)


def test_another_site_cannot_open_a_websocket_to_a_local_page(local: int) -> None:
    assert not opens_websocket(local, Origin='http://elsewhere.example')


def test_a_local_page_answers_to_no_foreign_name(local: int) -> None:
    # a name of somebody else's domain that leads to 127.0.0.1
    assert get(local, Host=f'elsewhere.example:{local}')[0] == 403


def status_of(port: int, request: bytes) -> int:
    """Return the status that answers a request as it is."""
    with socket.create_connection(('127.0.0.1', port), timeout=60) as connection:
        connection.sendall(request)
        return int(connection.makefile('rb').readline().split()[1])


@pytest.mark.parametrize('target, host, more', [
    (b'/', b'[', b''),
    (b'/', b'127.0.0.1:port]', b''),
    (b'/', b'127.0.0.1:port', b''),
    (b'/', b'127.0.0.1:99999', b''),
    (b'/', b'127.0.0.1', b'Host: 127.0.0.1\r\n'),
    (b'/', b'127.0.0.1', b'Origin: null\r\n'),
    (b'/', b'127.0.0.1', b'Origin: http://[\r\n'),
    (b'http://[', b'127.0.0.1', b''),
    (b'http://127.0.0.1/', b'127.0.0.1', b''),
    (b'', b'127.0.0.1', b''),
    (b'*', b'127.0.0.1', b''),
    (b'//etc/passwd', b'127.0.0.1', b''),
    (b'/%2f/etc/passwd', b'127.0.0.1', b''),
    (b'/../../etc/passwd', b'127.0.0.1', b''),
    (b'/%2e%2e/etc/passwd', b'127.0.0.1', b''),
    (b'/\\elsewhere.example', b'127.0.0.1', b''),
    (b'/%00', b'127.0.0.1', b''),
    (b'/%ff', b'127.0.0.1', b''),
    (b'/\xff', b'127.0.0.1', b''),
    (b'/hover?page=0&x=0&y=', b'127.0.0.1', b''),
    (b'/' + 5000 * b'a', b'127.0.0.1', b''),
    (b'/hover?page=[&x=%ff&y=1', b'[::', b''),
    (b'/\xff', b'\xff', b'Cookie: \xff\r\n'),
])
def test_a_malformed_request_is_refused(guarded: int, local: int, target, host, more) -> None:
    request = b'GET ' + target + b' HTTP/1.1\r\nHost: ' + host + b'\r\n' + more + b'\r\n'
    assert (status_of(local, request), status_of(guarded, request)) == (403, 403)


@pytest.mark.parametrize('rest', [b'', b'\xff\xff\xff\xff', b'\x00\x00', b'GET / HTTP/1.1\r\n'])
def test_who_does_not_wait_for_the_answer_leaves_no_traceback(
    local: int, rest, capfd, caplog,
) -> None:
    for target in (b'/', b'/nothing', b'//', 2000 * b'/a'):
        with socket.create_connection(('127.0.0.1', local), timeout=60) as connection:
            connection.sendall(b'GET ' + target + b' HTTP/1.1\r\nHost: [\r\n\r\n' + rest)
            connection.shutdown(socket.SHUT_WR)
            with contextlib.suppress(ConnectionError):
                connection.recv(100)
    assert get(local)[0] == 200
    assert 'Traceback' not in capfd.readouterr().err
    assert [record for record in caplog.records if record.exc_info] == []


def test_a_path_where_nothing_is_is_not_found(local: int) -> None:
    assert get(local, '/nothing')[0] == 404


@pytest.mark.parametrize('frame', [
    b'', b'\xc1', 'text', msgspec.msgpack.encode([]), msgspec.msgpack.encode({}),
    msgspec.msgpack.encode({'type': 'Nonsense'}),
    msgspec.msgpack.encode({'type': 'GuiUpdateMessage', 'uuid': 7, 'updates': 7}),
])
def test_a_frame_of_garbage_leaves_no_traceback(local: int, frame, capfd, caplog) -> None:
    with connect(f'ws://127.0.0.1:{local}', subprotocols=[PROTOCOL], open_timeout=60) as page:
        page.send(frame)
        with contextlib.suppress(ConnectionClosed, TimeoutError):
            for _ in range(100):        # what the page sends, until it has read the frame
                page.recv(timeout=1.0)
    assert get(local)[0] == 200
    assert 'Traceback' not in capfd.readouterr().err
    assert [record for record in caplog.records if record.exc_info] == []


def test_a_page_is_open_on_this_machine_only_by_default() -> None:
    server, _ = open_page(port=0)
    try:
        own = socket.gethostbyname(socket.gethostname())
        if own.startswith('127.'):
            own = '127.0.0.2'       # this machine, by an address that was not opened
        with pytest.raises(OSError, match='refused'), socket.create_connection(
                (own, server.get_port()), timeout=10):
            pass
    finally:
        stop(server)


def test_a_page_for_other_machines_is_guarded_and_says_so(
    capsys: pytest.CaptureFixture[str],
) -> None:
    server, address = open_page('0.0.0.0', 0)
    try:
        said = capsys.readouterr()
        assert 'anyone who has the address below can drive the simulation' in said.err
        assert address in said.out
        assert get(server.get_port())[0] == 403
        assert get(server.get_port(), '/?' + address.partition('?')[2])[0] == 303
    finally:
        stop(server)


def test_each_page_for_other_machines_has_a_token_of_its_own() -> None:
    addresses = set()
    for _ in range(2):
        server, address = open_page('0.0.0.0', 0)
        addresses.add(address.partition('token=')[2])
        stop(server)
    assert len(addresses) == 2
    assert min(map(len, addresses)) >= 32


def test_an_address_of_another_machine_is_refused_at_once() -> None:
    with pytest.raises(AddressError, match=r'--host 192\.0\.2\.1: .* must be an address of this'):
        open_page('192.0.2.1')


@pytest.mark.parametrize(('host', 'answer'), [
    ('127.0.0.1', True), ('localhost', True), ('::1', True), ('127.3.2.1', True),
    ('0.0.0.0', False), ('192.168.1.5', False), ('robot.local', False)])
def test_local_addresses_are_told_from_others(host: str, answer: bool) -> None:
    assert is_local(host) is answer

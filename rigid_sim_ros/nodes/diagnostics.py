# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What /diagnostics says about the node, by default once a second of wall time.

Five statuses: `pace` (rate, real-time factor, overruns, lateness, cost), `inputs` (accepted and
refused), `physics` (energy and momentum), `contact` (pairs, overlap, solver) and `recording`.
Counters run from the start of the node, or of the recording; rates, shares and lateness are those
of the window since the last message.
"""
from math import ceil

from rigid_sim_ros.messages.codec import Status
from rigid_sim_ros.nodes.inputs import Refusals
from rigid_sim_ros.nodes.pacing import Lateness, Pacer
from rigid_sim_ros.nodes.publishers import Publishers
from rigid_sim_ros.nodes.recording import NOT_RECORDING, Recording
from rigid_sim_ros.times import SECOND
from rigid_sim_ros.world import World

_OK, _WARN, _ERROR = 0, 1, 2


class Diagnostics:
    """Collects figures in the step thread and publishes them."""

    def __init__(
        self, name: str, world: World, publishers: Publishers, refusals: Refusals, pacer: Pacer,
        recording: Recording,
    ) -> None:
        self.accepted = 0       # wrenches, from the start
        self.accepted_of_joints = 0     # messages to joints, likewise
        self.period_ns: float = SECOND
        self._name = name
        self._world = world
        self._publishers = publishers
        self._refusals = refusals
        self._pacer = pacer
        self._recording = recording
        self._late_ns: list[int] = []
        self.begin(0, 0)

    def begin(self, now_ns: int, thread_ns: int) -> None:
        """Start a window at a wall time and a CPU time of the step thread."""
        self._begun_ns = now_ns
        self._thread_ns = thread_ns
        self._steps = self._pacer.steps
        self._overruns = self._pacer.overruns
        self._dropped_ns = self._pacer.dropped_ns
        self._refused = sum(self._refusals.counts().values())
        self._messages, self._cost_ns = self._publishers.messages, self._publishers.cost_ns
        self._recorded = self._publishers.recorded
        self._recording_ns = self._publishers.recording_ns
        self._late_ns.clear()

    def is_due(self, now_ns: int) -> bool:
        """Return whether the window is over."""
        return now_ns - self._begun_ns >= self.period_ns

    def note(self, lateness: Lateness) -> None:
        """Keep how late a batch of steps began."""
        self._late_ns.append(lateness.late_ns)

    def publish(self, now_ns: int, thread_ns: int, paused: bool, broken: str) -> None:
        """Publish the figures of this window and begin the next."""
        statuses = [
            self._pace(now_ns - self._begun_ns, thread_ns - self._thread_ns, paused),
            self._inputs(),
            self._physics(broken),
            self._contact(),
            self._recorder(),
        ]
        self.begin(now_ns, thread_ns)
        self._publishers.publish_diagnostics(self._world.time_ns, statuses)

    def _status(self, part: str, level: int, message: str, values: dict[str, object]) -> Status:
        texts = [(key, str(value)) for key, value in values.items()]
        return Status(level, f'{self._name}: {part}', message, self._world.scene.name, texts)

    def _pace(self, wall_ns: int, thread_ns: int, paused: bool) -> Status:
        pacer, publishers = self._pacer, self._publishers
        steps = pacer.steps - self._steps
        overruns = pacer.overruns - self._overruns
        messages = publishers.messages - self._messages
        cost_ns = publishers.cost_ns - self._cost_ns
        values: dict[str, object] = {
            'simulation time [s]': f'{self._world.time_ns / SECOND:.9f}',
            'step [s]': f'{self._world.step_ns / SECOND:.9f}',
            'steps per second': f'{steps * SECOND / wall_ns:.1f}',
            'real-time factor': f'{steps * self._world.step_ns / wall_ns:.4f}',
            'real-time factor wanted': f'{pacer.factor:g}' if pacer.factor else 'unlimited',
            'overruns': pacer.overruns,
            'overruns lately': overruns,
            'wall time given up [s]': f'{pacer.dropped_ns / SECOND:.3f}',
            'lateness median [us]': f'{self._late_us(0.5):.0f}',
            'lateness 99 % [us]': f'{self._late_us(0.99):.0f}',
            'lateness worst [us]': f'{self._late_us(1.0):.0f}',
            'step thread CPU share [%]': f'{100 * thread_ns / wall_ns:.1f}',
            'messages per second': f'{messages * SECOND / wall_ns:.0f}',
            'cost per message [us]': f'{cost_ns / max(1, messages) / 1e3:.2f}',
        }
        clocks = publishers.clock_publishers()
        if clocks > 1:
            text = (f'{clocks} publishers on /clock: set publish_clock to false for all '
                    'simulations but one')
            return self._status('pace', _WARN, text, values)
        # A step that is late is made up for; the pace is not held where that is not possible.
        if given_up := pacer.dropped_ns - self._dropped_ns:
            text = f'cannot keep the pace: {given_up / SECOND:.3f} s given up lately'
            return self._status('pace', _WARN, text, values)
        return self._status('pace', _OK, 'paused' if paused else 'running', values)

    def _inputs(self) -> Status:
        counts = self._refusals.counts()
        refused = sum(counts.values())
        new = refused - self._refused
        values: dict[str, object] = {
            'wrenches accepted': self.accepted,
            'joint messages accepted': self.accepted_of_joints, 'refused': refused}
        for reason in sorted(counts):
            values[f'refused: {reason}'] = counts[reason]
        if new:
            return self._status('inputs', _WARN, f'{new} refused lately', values)
        return self._status('inputs', _OK, 'nothing refused', values)

    def _physics(self, broken: str) -> Status:
        world = self._world
        kinetic, potential = world.kinetic_energy(), world.potential_energy()
        values: dict[str, object] = {
            'bodies': len(world.names),
            'kinetic energy [J]': f'{kinetic:.9g}',
            'potential energy [J]': f'{potential:.9g}',
            'energy [J]': f'{kinetic + potential:.9g}',
        }
        momenta = {
            'momentum {} [kg m/s]': world.total_momentum(),
            'angular momentum {} [kg m^2/s]': world.total_angular_momentum(),
        }
        for key, vector in momenta.items():
            for axis, component in zip('xyz', vector, strict=True):
                values[key.format(axis)] = f'{component:.9g}'
        if broken:
            return self._status('physics', _ERROR, broken, values)
        return self._status('physics', _OK, 'every motion is finite', values)

    def _contact(self) -> Status:
        report = self._world.contact_report()
        values: dict[str, object] = {
            'pairs': report.pairs,
            'pairs settled by their witness': report.witnessed,
            'contacts': report.contacts,
            'deepest overlap [m]': f'{report.deepest:.3e}',
            'bodies asleep': report.asleep,
            'solver residual': f'{report.residual:.3e}',
            'solver iterations': report.iterations,
        }
        if report.message:
            return self._status('contact', _WARN, report.message, values)
        return self._status('contact', _OK, f'{report.contacts} contacts', values)

    def _recorder(self) -> Status:
        status = self._recording.status()
        if status is None:
            return self._status('recording', _OK, NOT_RECORDING, {})
        recorded = self._publishers.recorded - self._recorded
        cost_ns = self._publishers.recording_ns - self._recording_ns
        values: dict[str, object] = {
            'path': status.path,
            'elapsed [s]': f'{self._recording.elapsed():.3f}',
            'messages': status.messages,
            'size [MB]': f'{status.size / 1e6:.3f}',
            'files': status.files,
            'queue [MB]': f'{status.queued_bytes / 1e6:.3f}',
            'gaps': status.gaps,
            'messages lost': status.lost_messages,
            'inputs lost': status.lost_events,
            'cost per message [us]': f'{cost_ns / max(1, recorded) / 1e3:.2f}',
        }
        if status.error:
            return self._status('recording', _ERROR, status.error, values)
        if not self._recording.is_active:
            return self._status('recording', _OK, f'recorded into {status.path}', values)
        if status.gaps or status.lost_messages:
            text = f'the disk did not keep up: {status.path} has gaps'
            return self._status('recording', _WARN, text, values)
        return self._status('recording', _OK, f'recording into {status.path}', values)

    def _late_us(self, quantile: float) -> float:
        """Return the lateness that this share of the batches did not exceed."""
        if not self._late_ns:
            return 0.0
        ranked = sorted(self._late_ns)
        return ranked[ceil(quantile * len(ranked)) - 1] / 1e3

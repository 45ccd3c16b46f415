# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags that others write: rosbag2's two storages by rosbags, and MCAP files of all kinds."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, IndexType, Writer as McapWriter
from rosbags.interfaces import (
    Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from rigid_sim_ros.bag.playable_files import Message
from rigid_sim_ros.bag.topics import typestore
from rigid_sim_ros.messages.codec import encode_string

STRING = 'std_msgs/msg/String'
_FOREVER = QosTime(9223372036, 854775807)

LATCHED = Qos(
    QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL, _FOREVER,
    _FOREVER, QosLiveliness.AUTOMATIC, _FOREVER, False)
BEST_EFFORT = LATCHED._replace(
    depth=5, reliability=QosReliability.BEST_EFFORT, durability=QosDurability.VOLATILE)

# As the writer of rosbag2 puts it into an MCAP file, before and since Jazzy.
LATCHED_TEXTS = (
    '- history: 3\n  depth: 0\n  reliability: 1\n  durability: 1\n  deadline:\n'
    '    sec: 9223372036\n    nsec: 854775807\n  lifespan:\n    sec: 9223372036\n'
    '    nsec: 854775807\n  liveliness: 1\n'
    '  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n'
    '  avoid_ros_namespace_conventions: false',
    '- history: keep_last\n  depth: 1\n  reliability: reliable\n  durability: transient_local\n',
)


def texts(name: str, count: int, step_ns: int, start_ns: int = 10 ** 9) -> list[Message]:
    """Return numbered messages of type String on a topic."""
    return [(start_ns + k * step_ns, name, encode_string(f'{name} {k}')) for k in range(count)]


def rosbag2(
    path: Path, messages: Sequence[Message], *, qos: Mapping[str, Sequence[Qos]] | None = None,
    types: Mapping[str, str] | None = None, storage: str = 'mcap', mode: str = 'NONE',
    version: Any = 9,
) -> Path:
    """Write a bag as `ros2 bag record` does."""
    plugin = StoragePlugin.MCAP if storage == 'mcap' else StoragePlugin.SQLITE3
    writer = Writer(path, version=version, storage_plugin=plugin)
    if mode != 'NONE':
        writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    with writer:
        connections = {
            name: writer.add_connection(
                name, (types or {}).get(name, STRING), typestore=typestore(),
                offered_qos_profiles=(qos or {}).get(name, ()))
            for name in dict.fromkeys(name for _, name, _ in messages)}
        for stamp, name, data in messages:
            writer.write(connections[name], stamp, data)
    return path


def mcap(
    path: Path, messages: Sequence[Message], *, latched: Mapping[str, str] | None = None,
    encoding: str = 'cdr', type_hash: str = '', **options: Any,
) -> Path:
    """Write an MCAP file with the library of that name; the messages as they come."""
    with path.open('wb') as file:
        writer = McapWriter(file, **{'compression': CompressionType.NONE, **options})
        writer.start(profile='ros2')
        schema = writer.register_schema(STRING, 'ros2msg', b'string data')
        channels: dict[str, int] = {}
        for k, (stamp, name, data) in enumerate(messages):
            if name not in channels:
                channels[name] = writer.register_channel(
                    name, encoding, schema,
                    {'offered_qos_profiles': (latched or {}).get(name, ''),
                     'topic_type_hash': type_hash})
            writer.add_message(channels[name], stamp, data, stamp, k)
        writer.finish()
    return path


# The ways in which an MCAP file may be laid out, by what its writer leaves out.
LAYOUTS: dict[str, dict[str, Any]] = {
    'all there is': {},
    'lz4': {'compression': CompressionType.LZ4},
    'zstd': {'compression': CompressionType.ZSTD},
    'no index of messages': {'index_types': IndexType.CHUNK},
    'no index of chunks': {'index_types': IndexType.MESSAGE},
    'no index': {'index_types': IndexType.NONE},
    'no chunks': {'use_chunking': False},
    'no chunks and no statistics': {'use_chunking': False, 'use_statistics': False},
    'no repeated channels': {'repeat_channels': False, 'repeat_schemas': False},
    'nothing that may be left out': {
        'index_types': IndexType.NONE, 'repeat_channels': False, 'repeat_schemas': False,
        'use_statistics': False, 'use_summary_offsets': False, 'enable_crcs': False},
}

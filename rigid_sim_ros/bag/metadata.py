# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The file metadata.yaml of a bag, in rosbag2's format 9."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
import json
import os
from pathlib import Path, PurePath
from typing import Annotated, Any, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.files import open_regular
from rigid_sim_ros.bag.topics import definition, qos_profiles, Topic
from rigid_sim_ros.scene import SceneError
from rigid_sim_ros.scene.document import YamlSource

NAME = 'metadata.yaml'
_VERSION = 9
_ROOT = 'rosbag2_bagfile_information'

# [bytes] Metadata of a thousand topics take 1 MB; more than this is something else.
_MOST = 64 << 20
_LONGEST_NAME = 255     # [bytes] of a file, on Linux


class FileFacts(NamedTuple):
    """One file of a bag."""

    name: str
    first_ns: int               # time of its first message, 0 if it has none
    last_ns: int
    counts: tuple[int, ...]     # messages by topic


def build(
    topics: Sequence[Topic], files: Sequence[FileFacts], storage: str, compression_mode: str = '',
    custom: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Return the metadata of a bag."""
    filled = [file for file in files if any(file.counts)]
    first_ns = min((file.first_ns for file in filled), default=0)
    last_ns = max((file.last_ns for file in filled), default=0)
    return {
        'version': _VERSION,
        'storage_identifier': storage,
        'duration': {'nanoseconds': last_ns - first_ns},
        'starting_time': {'nanoseconds_since_epoch': first_ns},
        'message_count': sum(sum(file.counts) for file in files),
        'topics_with_message_count': [{
            'topic_metadata': {
                'name': topic.name,
                'type': topic.type,
                'serialization_format': 'cdr',
                'offered_qos_profiles': qos_profiles(topic.latched),
                'type_description_hash': definition(topic.type)[1],
            },
            'message_count': sum(file.counts[k] for file in files),
        } for k, topic in enumerate(topics)],
        'compression_format': 'zstd' if compression_mode else '',
        'compression_mode': compression_mode,
        'relative_file_paths': [file.name for file in files],
        'files': [{
            'path': file.name,
            'starting_time': {'nanoseconds_since_epoch': file.first_ns},
            'duration': {'nanoseconds': file.last_ns - file.first_ns},
            'message_count': sum(file.counts),
        } for file in files],
        'custom_data': dict(custom or {}),
        'ros_distro': 'jazzy',
    }


def write(folder: Path, metadata: Mapping[str, Any]) -> None:
    """Put metadata.yaml in place at once: it is the old one or the new one, and never a part."""
    part = folder / f'.{NAME}.part'
    part.unlink(missing_ok=True)
    with part.open('xb') as file:       # never through a link
        file.writelines(line.encode() for line in _lines(metadata))
        file.flush()
        os.fsync(file.fileno())
    part.replace(folder / NAME)
    sync_folder(folder)


def sync_folder(folder: Path) -> None:
    """Make the names in a folder last beyond a power cut."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


class _Told(BaseModel):
    """A mapping of which only some keys matter to us."""

    model_config = ConfigDict(extra='allow', strict=True)


class _Time(_Told):
    nanoseconds_since_epoch: int


class _Duration(_Told):
    nanoseconds: int


class _File(_Told):
    path: str
    starting_time: _Time
    duration: _Duration
    message_count: Annotated[int, Field(ge=0)]


class _TopicMetadata(_Told):
    name: str


class _Topic(_Told):
    topic_metadata: _TopicMetadata
    message_count: Annotated[int, Field(ge=0)]


class _Metadata(_Told):
    """What of rosbag2's metadata is used; what a version of the format does not have is None."""

    relative_file_paths: list[str]
    compression_mode: str | None = None
    starting_time: _Time | None = None
    duration: _Duration | None = None
    message_count: Annotated[int, Field(ge=0)] | None = None
    topics_with_message_count: list[_Topic] | None = None
    files: list[_File] | None = None
    custom_data: dict[str, str | int | float | bool | None] | None = None


def read(folder: Path) -> dict[str, Any] | None:
    """Return the metadata of a bag, None if it has none; BagError when they are damaged."""
    path = folder / NAME
    try:
        with open_regular(path) as file:
            data = file.read(_MOST + 1)
        if len(data) > _MOST:
            raise BagError(f'{path}: more than {_MOST} bytes are too many for metadata')
        metadata = YamlSource(data.decode(), NAME).data[_ROOT]
        _Metadata.model_validate(metadata)
        _check_names(metadata['relative_file_paths'])
    except FileNotFoundError:
        return None
    except OSError as error:
        raise BagError(f'{path}: {error.strerror}') from None
    except (SceneError, ValueError, KeyError, TypeError) as error:
        if isinstance(error, BagError):
            raise
        raise BagError(f'{path} is damaged ({_reason(error)}): `rigid_sim recover {folder}` makes '
                       'it anew') from None
    return dict(metadata)


def _check_names(names: Sequence[str]) -> None:
    """Raise ValueError unless these may be the names of files, each of another one."""
    odd = [name for name in names if '\0' in name or not 0 < len(
        PurePath(name).name.encode(errors='replace')) <= _LONGEST_NAME]
    if odd or len({PurePath(name).name for name in names}) < len(names):
        raise ValueError(f'relative_file_paths, {(odd or list(names))[0][:40]!r}')


def _reason(error: Exception) -> str:
    if isinstance(error, ValidationError):
        first = error.errors(include_url=False, include_input=False)[0]
        return f'{".".join(map(str, first["loc"]))[:80]}, {first["msg"]}'
    if isinstance(error, SceneError):
        return error.problems[0].message[:200]
    return f'{type(error).__name__}: {str(error)[:80]}'


def _lines(metadata: Mapping[str, Any]) -> Iterator[str]:
    """
    Give metadata as YAML, an entry to a line; of tens of thousands of topics all take much room.

    JSON is YAML too, and is written a hundred times faster than by a YAML library: the step loop
    has to wait for whoever holds the interpreter.
    """
    yield f'{_ROOT}:\n'
    for key, value in metadata.items():
        if isinstance(value, list) and value:
            yield f'  {key}:\n'
            for item in value:
                yield f'  - {json.dumps(item)}\n'
        else:
            yield f'  {key}: {json.dumps(value)}\n'


@cache
def profiles_text(latched: bool) -> str:
    """Return the quality of service as it stands in a file of a bag."""
    profiles = qos_profiles(latched)
    return json.dumps(profiles) if profiles else ''

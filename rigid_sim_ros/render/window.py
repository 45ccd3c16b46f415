# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Find a graphics library that draws without a display.

VTK brings none. It ends the process, without a word, where there is none, and looks for a display
first, which costs a warning: so this looks before VTK does.
"""

from collections.abc import Callable
import ctypes
import os

from rigid_sim_ros.bag.errors import BagError

_CHOICE = 'VTK_DEFAULT_OPENGL_WINDOW'       # VTK's own variable; what the user sets there counts
_MEND = ('render needs EGL or OSMesa, with which Mesa draws without a display: `apt install '
         'libegl1 libgl1-mesa-dri`, or `dnf install mesa-libEGL mesa-dri-drivers`')


def choose_window() -> None:
    """Tell VTK which window to open; BagError if it could open none."""
    if _CHOICE in os.environ:
        return
    for name, works in _WINDOWS.items():
        if works():
            os.environ[_CHOICE] = name
            return
    raise BagError(_MEND)


def _has_egl() -> bool:
    """Return whether EGL has a device, be it one of software; VTK draws on the first."""
    try:
        egl = ctypes.CDLL('libEGL.so.1')
        egl.eglGetProcAddress.restype = ctypes.c_void_p
        egl.eglGetProcAddress.argtypes = [ctypes.c_char_p]
        address = egl.eglGetProcAddress(b'eglQueryDevicesEXT')
    except (OSError, AttributeError):
        return False
    if not address:
        return False
    # EGLBoolean eglQueryDevicesEXT(EGLint max_devices, EGLDeviceEXT *devices, EGLint *num_devices)
    query = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.c_void_p,
                             ctypes.POINTER(ctypes.c_int))(address)
    count = ctypes.c_int(0)
    return bool(query(0, None, ctypes.byref(count))) and count.value > 0


def _has_osmesa() -> bool:
    for name in ('libOSMesa.so', 'libOSMesa.so.8', 'libOSMesa.so.6'):
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return True
    return False


_WINDOWS: dict[str, Callable[[], bool]] = {
    'vtkEGLRenderWindow': _has_egl,
    'vtkOSOpenGLRenderWindow': _has_osmesa,
}

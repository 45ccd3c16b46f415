# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The web server of the page, and who may reach it."""
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
import gzip
from hashlib import sha256
from hmac import compare_digest
from html import escape
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from importlib.resources import files
from io import StringIO
from ipaddress import ip_address
import threading
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

import viser
import websockets.asyncio.server
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from rigid_sim_ros.viewer.garbage import Handler, patient
from rigid_sim_ros.viewer.waking import wake_in_the_loop

LOCAL = '127.0.0.1'
_LOCAL_NAMES = frozenset({'localhost', LOCAL, '::1'})
_TOKEN = 'token'
# What is added to viser's page.
_SCRIPTS = ('drawing.js', 'culling.js', 'hover.js', 'title.js')

Check = Callable[[Any, Request], Any]
# Takes a page by its number, and a point of its picture from 0 to 1, from the left and the top.
NameAt = Callable[[int, float, float], str]


class Gate:
    """
    Answers requests that have no business here, before the page sees them.

    With a token, only who has it comes in: from the address that was printed, ?token=..., and
    from then on by a cookie. Without one the page is for this machine: a request must have come
    under one of its own names, so that no foreign name that leads here gets through. In both
    cases a WebSocket must be opened by this very page: a browser would let any other page that
    its user visits open one, and drive the simulation.
    """

    def __init__(self, token: str = '') -> None:
        self._token = token
        self._cookie = f'rigid_sim_{sha256(token.encode()).hexdigest()[:12]}'

    def answer(self, request: Request) -> Response | None:
        """Return what to answer, or None to let the request through."""
        url = urlsplit(request.path)
        host = _one(request, 'Host')
        if not (_is_address(host) and _is_path(request.path)):
            return _refusal()
        if 'Origin' in request.headers and urlsplit(_one(request, 'Origin')).netloc != host:
            return _refusal()
        if not self._token:
            return None if urlsplit(f'//{host}').hostname in _LOCAL_NAMES else _refusal()
        given = parse_qs(url.query).get(_TOKEN, [])
        if any(self._is_token(text) for text in given):
            # Out of the address bar, and with that out of bookmarks and screenshots.
            return Response(HTTPStatus.SEE_OTHER, 'See Other', Headers({
                'Location': url.path or '/', 'Content-Length': '0', 'Cache-Control': 'no-store',
                'Set-Cookie': f'{self._cookie}={self._token}; HttpOnly; SameSite=Lax; Path=/'}))
        return None if self._is_token(self._cookie_of(request)) else _refusal()

    def _is_token(self, text: str) -> bool:
        return compare_digest(text.encode(), self._token.encode())

    def _cookie_of(self, request: Request) -> str:
        cookies = SimpleCookie()
        try:
            for line in request.headers.get_all('Cookie'):
                cookies.load(line)
        except CookieError:
            return ''
        return cookies[self._cookie].value if self._cookie in cookies else ''


def _one(request: Request, name: str) -> str:
    """Return a header that must not be there twice."""
    values = request.headers.get_all(name)
    return values[0] if len(values) == 1 else ''


def _is_address(host: str) -> bool:
    """Return whether a name or an address stands there, with a port or without one."""
    try:
        return urlsplit(f'//{host}').port != 0      # which must be a number below 2^16
    except ValueError:
        return False


def _is_path(target: str) -> bool:
    """Return whether a request names a place below the root, in characters that can be printed."""
    path = unquote(target.partition('?')[0], errors='strict')
    return (target.startswith('/') and not path.startswith('//') and '..' not in path.split('/')
            and '\\' not in path and path.isprintable() and target.isascii())


class Hover:
    """
    Tells pages the name of the body under the mouse.

    viser's own page has no such thing: a script that is added to it asks here.
    """

    def __init__(self) -> None:
        self.name_at: NameAt = lambda page, x, y: ''
        self._pages: dict[bool, bytes] = {}     # by whether they are compressed

    def answer(self, request: Request) -> Response | None:
        """Return a script or a name, or None if the request is not for these."""
        url = urlsplit(request.path)
        if url.path.lstrip('/') in _SCRIPTS:
            script = files('rigid_sim_ros.viewer').joinpath(url.path.lstrip('/'))
            return _found(script.read_bytes(), 'text/javascript')
        if url.path != '/hover':
            return None
        words = parse_qs(url.query)
        try:
            page, x, y = int(words['page'][0]), float(words['x'][0]), float(words['y'][0])
        except (KeyError, ValueError):
            return _refusal()
        return _found(self.name_at(page, x, y).encode(), 'text/plain')

    def extend(self, request: Request, response: Response | None) -> Response | None:
        """Add the scripts to the page, which is what viser answers to `/`."""
        if response is None or urlsplit(request.path).path not in ('/', '/index.html'):
            return response
        is_packed = response.headers.get('Content-Encoding') == 'gzip'
        if is_packed not in self._pages:
            page = gzip.decompress(response.body) if is_packed else bytes(response.body)
            tags = ''.join(f'<script src="{name}"></script>' for name in _SCRIPTS)
            page = page.replace(b'</body>', f'{tags}</body>'.encode())
            self._pages[is_packed] = gzip.compress(page) if is_packed else page
        response.body = self._pages[is_packed]
        del response.headers['Content-Length']      # setting adds another
        response.headers['Content-Length'] = str(len(response.body))
        return response


def _found(content: bytes, kind: str) -> Response:
    return Response(HTTPStatus.OK, 'OK', Headers({
        'Content-Type': f'{kind}; charset=utf-8', 'Content-Length': str(len(content)),
        'Cache-Control': 'no-store'}), content)


def _refusal() -> Response:
    return Response(HTTPStatus.FORBIDDEN, 'Forbidden',
                    Headers({'Content-Length': '0', 'Connection': 'close'}))


class PageServer(viser.ViserServer):
    """viser's server with names under the mouse."""

    hover: Hover
    _title: Any = None

    def set_title(self, text: str) -> None:
        """Name what the page shows, in the tab of the browser and above the panel."""
        content = f'<span hidden data-rigid-sim-title="{escape(text)}"></span>'
        if self._title is None:
            self._title = self.gui.add_html(content)
        elif self._title.content != content:
            self._title.content = content
        self.gui.set_panel_label(text)

    def request_share_url(self, verbose: bool = True) -> None:
        """Open no tunnel to the internet, whatever a page asks for."""


def is_local(host: str) -> bool:
    """Return whether only this machine can reach a page at this address."""
    try:
        return host == 'localhost' or ip_address(host).is_loopback
    except ValueError:
        return False


def start(host: str, port: int, token: str = '') -> PageServer:
    """
    Start the server at an address; a port that is taken gives way to the next free one.

    Whoever brings no token gets nothing, if one is given.
    """
    hover = Hover()
    wake_in_the_loop()
    with _guarded(Gate(token), hover) as is_guarded, redirect_stdout(StringIO()):
        server = PageServer(host=host, port=port, verbose=False)
    server.hover = hover
    if not is_guarded.is_set():     # this version of viser opens its port in another way
        server.stop()
        raise RuntimeError('the page cannot be guarded with this version of viser')
    server.gui.configure_theme(show_logo=False, show_share_button=False, control_width='medium')
    server.gui.main_panel.dock_right()      # beside the picture, not over it
    # Light from all around, besides the lamps that cast shadows. viser's picture of surroundings
    # does that too: without a graphics card a frame then takes a second, and colours fade.
    server.scene.configure_environment_map(None)
    server.scene.add_light_hemisphere(
        '/light', sky_color=(255, 255, 255), ground_color=(150, 150, 160), intensity=1.6)
    server.on_client_connect(_number)
    return server


def _number(client: viser.ClientHandle) -> None:
    """Tell the script in a page which one it is."""
    client.gui.add_html(f'<span hidden data-rigid-sim-page="{client.client_id}"></span>')


def stop(server: viser.ViserServer) -> None:
    """Close the page."""
    with redirect_stdout(StringIO()):
        server.stop()


@contextmanager
def _guarded(gate: Gate, hover: Hover) -> Iterator[threading.Event]:
    """Let a server that is started in the block ask the gate first; the event says it will."""
    # viser offers no place for that, but what it calls to open the port has one.
    serve = websockets.asyncio.server.serve
    is_guarded = threading.Event()

    def guarded(handler: Handler, *args: Any, process_request: Check, **options: Any) -> Any:

        def check(connection: Any, request: Request) -> Any:
            try:
                answer = gate.answer(request) or hover.answer(request)
                if answer is not None:
                    return answer
                return hover.extend(request, process_request(connection, request))
            except (OSError, ValueError):       # an address or a path that is none
                return _refusal()

        is_guarded.set()
        return serve(patient(handler), *args, process_request=check, **options)

    websockets.asyncio.server.serve = guarded   # type: ignore[assignment,misc]
    try:
        yield is_guarded
    finally:
        websockets.asyncio.server.serve = serve     # type: ignore[misc]

"""Who may use the server: checks of a request's address, Host and Origin. Nothing here knows a socket.

Against other pages in the same browser: a page of another origin can open a websocket to this machine, and one whose name
is made to resolve to this machine (DNS rebinding) has its own name in Host. Against others on the network: the token.
"""

import hmac
import ipaddress
import socket
from urllib.parse import urlsplit


class Gate:
    def __init__(self, token):
        self._token = token.encode()
        self._names = {"localhost", socket.gethostname().lower(), socket.getfqdn().lower()}

    def has_token(self, path):
        """Whether a request's path is /TOKEN/ or /TOKEN."""
        parts = path.split("?", 1)[0].split("/")
        rest = [part for part in parts[2:] if part]
        given = parts[1].encode(errors="replace") if len(parts) > 1 else b""
        return hmac.compare_digest(given, self._token) and not rest

    def is_own_host(self, host):
        """Whether Host is an address or a name of this machine. Any port will do: it may be forwarded."""
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            return False
        if name in self._names:
            return True
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True

    @staticmethod
    def is_own_origin(origin, host):
        """Whether the page that opens a websocket is this server's own. Programs that are no browsers send no Origin."""
        try:
            parts = urlsplit(origin)
        except ValueError:
            return False
        return parts.scheme in ("http", "https") and parts.netloc.lower() == host.lower()

#!/usr/bin/env python3
"""Serves the page of neat with the headers by which browsers give it threads.

    scripts/serve_page.py PAGE [PORT]

On this machine only, at port 8000 unless another is given. Needs Python 3.9 and nothing else.
"""

import argparse
import functools
import http.server

# Pages with these two may share memory between workers.
ISOLATION = {
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Embedder-Policy": "require-corp",
}


class Handler(http.server.SimpleHTTPRequestHandler):
    """Files, with the headers."""

    extensions_map = {**http.server.SimpleHTTPRequestHandler.extensions_map, ".wasm": "application/wasm"}

    def end_headers(self):
        for name, value in ISOLATION.items():
            self.send_header(name, value)
        super().end_headers()


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("page", help="what scripts/make_page.sh made")
    parser.add_argument("port", type=int, nargs="?", default=8000)
    options = parser.parse_args()
    handler = functools.partial(Handler, directory=options.page)
    with http.server.ThreadingHTTPServer(("127.0.0.1", options.port), handler) as server:
        print(f"http://127.0.0.1:{server.server_port}/", flush=True)
        server.serve_forever()


if __name__ == "__main__":
    main()

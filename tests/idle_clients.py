"""Many clients of a gateway that only listen, and one that never reads: ``python idle_clients.py COUNT PORT``.

Tells "open" when all streams are there, and ends when its input does; then it tells how much came to those that read.
"""

from __future__ import annotations

import select
import socket
import sys


def connected(port: int, path: str, received: int = 0) -> socket.socket:
    """A client that has asked for a stream."""
    client = socket.socket()
    if received:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, received)
    client.connect(("127.0.0.1", port))
    client.sendall(f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
    return client


def main(count: int, port: int) -> None:
    never_reads = connected(port, "/estimates?full=1", received=4096)
    clients = {client.fileno(): client for client in (connected(port, "/estimates") for _ in range(count))}
    poll = select.epoll()
    for number in clients:
        poll.register(number, select.EPOLLIN)
    poll.register(sys.stdin.fileno(), select.EPOLLIN)
    came: dict[int, int] = dict.fromkeys(clients, 0)
    said_open = False
    while True:
        for number, _ in poll.poll(0.1):
            if number == sys.stdin.fileno():
                print(min(came.values()), flush=True)
                never_reads.close()
                return
            came[number] += len(clients[number].recv(1 << 20))
        if not said_open and all(came.values()):
            said_open = True
            print("open", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))

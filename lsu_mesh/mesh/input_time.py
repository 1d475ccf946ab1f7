"""At which moment an input begins to act. Admission asks here; what an input says is true then for all who use it."""

from __future__ import annotations

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Input, Refused


def check_beginning(configuration: Configuration, message: Input) -> None:
    """An input of step k begins to act at t_k, or up to ``input_delay`` after it; one of a program, anywhere in it.

    Raises
    ------
    Refused
        ``off the grid``: the model is discrete, and knows no input that acts for a part of a step. ``time``: it begins
        before its step, or later than declared.
    """
    if message.time_ns is None:
        return
    start, delay = configuration.grid.time_of(message.step), configuration.input_delay_ns
    late = message.time_ns - start
    if 0 <= late <= delay:
        return
    if configuration.continuous is None:
        text = (
            f"the input of step {message.step} begins {late} ns after it, and a discrete model knows whole steps only; "
            "give a continuous model with input_delay"
        )
        raise Refused("off the grid", text)
    text = (
        f"the input of step {message.step} begins at {message.time_ns} ns, {late} ns after its step, and not within "
        f"input_delay = {delay} ns; name the step in which it begins, or declare a longer input_delay"
    )
    raise Refused("time", text)

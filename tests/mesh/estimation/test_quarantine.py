"""The quarantine counts steps, not messages: what is done again replaces what was noted."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from lsu_mesh.mesh.estimation.quarantine import Quarantine
from lsu_mesh.mesh.messages import Event, Message


class Story:
    """A quarantine of sources a and b with a memory of what it said."""

    def __init__(self, after: int, history: int = 4) -> None:
        self.quarantine = Quarantine(["a", "b"], after, history)
        self.said: list[tuple[int, str, bool]] = []

    def record(self, k: int, left_out: str = "", agreed: str = "") -> None:
        def say(name: str, is_in: bool) -> Message:
            self.said.append((k, name, is_in))
            return Event(
                v=1, src="fusion/main", boot="0" * 16, seq=0, step=k, sent_ns=0, origin_ns=0, model="", level="INFO",
                code="x", text="", about={},
            )  # fmt: skip

        count = len(self.said)
        messages = self.quarantine.record(k, set(left_out), set(agreed), say)
        assert len(messages) == len(self.said) - count


def test_a_source_goes_in_after_so_many_steps_and_comes_out_after_as_many_that_agree() -> None:
    story = Story(after=3)
    for k in range(1, 6):
        story.record(k, left_out="a", agreed="b")
    for k in range(6, 10):
        story.record(k, agreed="ab")
    assert story.said == [(3, "a", True), (8, "a", False)]


def test_a_source_that_lies_every_other_step_goes_in_and_stays() -> None:
    story = Story(after=3)
    for k in range(1, 21):
        story.record(k, left_out="a" if k % 2 else "", agreed="b" if k % 2 else "ab")
    assert story.said == [(5, "a", True)]


def test_a_source_that_is_not_there_is_neither_left_out_nor_does_it_agree() -> None:
    story = Story(after=2)
    for k in (1, 2):
        story.record(k, left_out="a")
    for k in range(3, 30):
        story.record(k, agreed="b")
    assert story.quarantine.members == {"a"}


def test_steps_that_are_done_again_count_once() -> None:
    story = Story(after=3)
    for _ in range(5):
        for k in (1, 2):
            story.record(k, left_out="a", agreed="b")
    assert story.quarantine.members == set()
    story.record(3, left_out="a")
    assert story.quarantine.members == {"a"}
    story.record(2, agreed="a")
    assert story.quarantine.members == set(), "step 2 was found to be fine after all"


@given(
    st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=40),
    st.integers(1, 5),
    st.integers(0, 6),
)
def test_what_is_done_again_at_once_changes_nothing(steps: list[tuple[bool, bool]], after: int, history: int) -> None:
    plain, noisy = Story(after, history), Story(after, history)
    for k, (first, second) in enumerate(steps, start=1):
        plain.record(k, left_out="a" if second else "", agreed="" if second else "a")
        noisy.record(k, left_out="a" if first else "", agreed="" if first else "a")
        noisy.record(k, left_out="a" if second else "", agreed="" if second else "a")
        assert noisy.quarantine.members == plain.quarantine.members


def test_a_count_is_forgotten_after_long_agreement() -> None:
    story = Story(after=4)
    for k in range(1, 100):
        is_wrong = k % 5 == 0
        story.record(k, left_out="a" if is_wrong else "", agreed="" if is_wrong else "a")
    assert story.said == []

"""The curriculum: easy tasks first, and the next one when most of the last episodes reached their goal."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class Curriculum:
    """Which tasks are driven now. Half of the episodes are of the newest task, the others of those before it.

    advance_at: share of goals at which the next task comes, 0 for all tasks at once; window: episodes that it is taken
    over. level: number of the newest task; recent: whether its last episodes reached their goal.
    """

    tasks: tuple[str, ...]
    advance_at: float
    window: int
    level: int = 0
    recent: list[bool] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.advance_at == 0:
            self.level = len(self.tasks) - 1

    def note(self, task: str, success: bool) -> bool:
        """Notes how an episode of a task ended; returns whether the next task comes now."""
        if task != self.tasks[self.level]:
            return False
        self.recent = [*self.recent, success][-self.window :]
        is_last = self.level == len(self.tasks) - 1
        if is_last or len(self.recent) < self.window or sum(self.recent) < self.advance_at * self.window:
            return False
        self.level, self.recent = self.level + 1, []
        return True

    def drawn(self) -> tuple[str, ...]:
        """The tasks from which an episode's is drawn evenly."""
        if self.advance_at == 0:
            return self.tasks
        return self.tasks[: self.level] + self.tasks[self.level : self.level + 1] * max(1, self.level)

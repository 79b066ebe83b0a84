"""Competitors that are not cut."""

from functools import partial

from dsfab.study.baselines.task import ComparisonTask, Structure, Variant


def thinner(task: ComparisonTask) -> list[Variant]:
    """The whole surface, everywhere as thin as the design is light."""
    thickness = task.share * task.preset.statics.thickness
    return [Variant("", partial(Structure.uncut, task.surface, thickness))]

"""Competitors that are not cut."""

from functools import partial

from dsfab.study.baselines.task import ComparisonTask, Structure, Variant


def thinner(brief: ComparisonTask) -> list[Variant]:
    """The whole surface, everywhere as thin as the design is light."""
    thickness = brief.share * brief.preset.statics.thickness
    return [Variant("", partial(Structure.uncut, brief.surface, thickness))]

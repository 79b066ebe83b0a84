"""Topology optimisation by density (SIMP) on any triangle surface: the competitor that the paper names."""

from dsfab.study.simp.density import Densities, Simp, densities
from dsfab.study.simp.filtering import face_filter

__all__ = ["Densities", "Simp", "densities", "face_filter"]

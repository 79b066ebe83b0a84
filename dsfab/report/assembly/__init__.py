"""How a workshop's parts become the structure: `assembly.pdf` and `index.html`, and what these need.

axonometry   members as they are seen from far away      sequence   which are put up when
paper        a sheet of paper to draw on                 overview, families, flat_parts, steps   its pages
refolding    flat parts bent back beside the design      bars, joint   pages of bars, and of one node in full
book         all of them: `assembly_pdf`      page       the same to turn and to click on: `assembly_page`
shades       what it colours members by
"""

from dsfab.report.assembly.book import assembly_pdf
from dsfab.report.assembly.interactive_page import assembly_page
from dsfab.report.assembly.sequence import AssemblyStep, assembly_steps

__all__ = ["AssemblyStep", "assembly_page", "assembly_pdf", "assembly_steps"]

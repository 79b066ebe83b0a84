"""Documents for the assembly of flat parts: `assembly.pdf` and `index.html`.

axonometry   members in parallel projection        flat_parts     cut list, sheets, nodes, families
paper        drawing on a sheet of paper           bar_pages      pages of bars and joints
overview     cover, views, bent parts, steps       card_model     the page for a model in card
book         all pages                             interactive_page   the page for a browser"""

from dsfab.report.assembly.book import assembly_pdf
from dsfab.report.assembly.interactive_page import assembly_page
from dsfab.report.assembly.overview import AssemblyStep, assembly_steps

__all__ = ["AssemblyStep", "assembly_page", "assembly_pdf", "assembly_steps"]

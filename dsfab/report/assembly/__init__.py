"""Documents for the assembly of flat parts: the book `assembly.pdf` and the interactive page `index.html`.

axonometry   members in parallel projection        sequence       steps of assembly and their pages
paper        drawing on a sheet of paper           flat_parts     cut list, sheets, nodes, families
overview     cover, views with names, bent parts   bar_pages      pages of bars and joints
book         all pages: `assembly_pdf`             card_model     the page for a model in card
interactive_page   the page to turn and click: `assembly_page`"""

from dsfab.report.assembly.book import assembly_pdf
from dsfab.report.assembly.interactive_page import assembly_page
from dsfab.report.assembly.sequence import AssemblyStep, assembly_steps

__all__ = ["AssemblyStep", "assembly_page", "assembly_pdf", "assembly_steps"]

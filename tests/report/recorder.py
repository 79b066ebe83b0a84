"""A canvas that records what a report draws."""

import io

from dsfab.report.assembly.paper import Paper


class Recorder(Paper):
    """Paper that remembers its words: text, lower left corner and size, millimetres."""

    def __init__(self):
        from reportlab.pdfgen.canvas import Canvas

        super().__init__(Canvas(io.BytesIO(), pagesize=(1200, 850)), ("Helvetica", "Helvetica-Bold"))
        self.words = []

    def text(self, at, words, size=7.0, colour=(0, 0, 0), side="left", bold=False):
        wide, high = self.width(words, size, bold), 0.35 * size * 0.72
        x = float(at[0]) - {"left": 0, "middle": wide / 2, "right": wide}[side]
        self.words.append((words, x, float(at[1]), wide, high))

    def upright_text(self, at, words, size, colour=(0, 0, 0)):
        self.words.append((words, at[0], at[1], 0.25 * size, self.width(words, size)))

"""The paper's figures and claims, reproduced on one page."""

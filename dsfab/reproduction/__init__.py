"""The paper's figures and claims, made again on one page."""

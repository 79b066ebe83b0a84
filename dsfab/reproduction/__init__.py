"""The figures and claims of the paper (Madan et al.), computed again and shown on a page."""

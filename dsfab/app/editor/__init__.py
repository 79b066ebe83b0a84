"""`dsfab edit`: a live structure in the user's own browser, served by a small server on this machine alone.

command ── opens ──► server (doors, security)     static/   the page
                        │  asks
                        ▼
                     session (what is opened)  ──  jobs (one worker, cancel)  ──  payload (arrays for the page)
"""

"""Pages, charts and folders for people: one for each question that dsfab answers."""

"""Pictures of the pages, and the figures of four documents."""

"""The web app: photos dropped on a page become a labelled room."""

"""Random labelled rooms from a seed. Folders, lowest layer first: pieces, assets, plans, drawing, sets."""

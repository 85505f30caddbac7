"""Class tables: ours, NYU40, and files with tables of your own."""

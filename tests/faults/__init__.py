"""`make faults`: kills commands while they write, takes away disk, memory and permissions, and checks what is left.

python -m faults                        with tests/ and tests/support on PYTHONPATH: everything that has no result in .faults yet
python -m faults --only train --count 5   five kills of one command
"""

"""`make fuzz`: damages files of every format that SemGS reads, and checks that each is read or refused in one line.

python -m fuzz --format sens --cases 2000 --seed 3     with tests/ and tests/support on PYTHONPATH
python -m fuzz --format sens --case 1234               one case again, with its traceback
"""

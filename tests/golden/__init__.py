"""Golden logs: five short trials, kept so that a change of structure can be seen to change no number.

On one machine every array must stay equal bit for bit:

    python -m tests.golden.compare record BEFORE    # with the code before
    python -m tests.golden.compare record AFTER     # with the code after
    python -m tests.golden.compare BEFORE AFTER     # lists what differs, through the table of `names`

Elsewhere `test_golden` compares a part of each log, kept in `logs/`, within tolerances, and `test_default_plan`
compares trials of the default plan, kept in `statistics.json`. The scenarios and the whole logs in `format1/` and
`format2/` stay in the form in which they were written: they are also what a reader of old files must be able to read.
"""

"""What the time stamps of a trial show: which ticks were late, what caused it, and whether the trial kept its budget.

Arrays in, arrays out; it needs only numpy. `late` has the rule for a late tick, `histogram` the quantiles of durations,
`attribution` the causes, `budget` the comparison with the trial's budget.
"""

"""Several characters in one scene: each sees the others as they move, and a rule says who goes first.

The rule.  A thing that one at a time can use (a seat, a door, a box) belongs to who comes to it first in
time, until that one is done with it and has left it; then to who has stood in line for it the longest.  Who
leaves the place where another is about to end goes before that one.  Where two ways cross, or lead through
the same narrow place, who is there first in time goes first.  Who is about to do something (sit down, rise,
hold a door, bend to a box, climb) gives way to nobody.  What is left, less than half a second's difference,
is decided by the order of the characters.  Others wait before it, for a goal no longer than
``crossing.PATIENCE`` without a step on in the line; who waits in somebody's way waits beside it; two that
block each other are parted: one steps aside, or its goal ends in one sentence.
"""

"""The controller of picking and placing, judged as table 4 and figure 5 of papers/002 do."""

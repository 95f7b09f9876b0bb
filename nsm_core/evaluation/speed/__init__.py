"""How fast it is: the network, takes by stage, cost as work grows, and ratios that hold on other machines."""

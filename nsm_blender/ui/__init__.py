"""The sidebar: panels, properties, operators and the take that runs behind them."""

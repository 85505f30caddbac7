"""What users run, as options with a `run`: the only place that knows an order of steps. Command line, app and batch show it in their own words."""

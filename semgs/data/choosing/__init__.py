"""Which frames become input views and target views."""

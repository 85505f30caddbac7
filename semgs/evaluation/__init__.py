"""Evaluation: protocols, metrics, tables and reports."""

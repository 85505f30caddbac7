"""The paper's comparison figures."""

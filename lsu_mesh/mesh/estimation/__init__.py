"""Pure tools of estimating nodes; the one step that node and verifier both call is here."""

"""Estimators on a window of data by linear programming (Pavelková, Kárný 2006 and 2014); they guarantee nothing."""

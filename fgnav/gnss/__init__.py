"""From raw observations to double differences: satellites, slips, code solution, differences."""

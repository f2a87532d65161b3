"""Types that pass between rooms: flights, double differences, integers, estimates."""

"""What passes between rooms: flights, double differences, integers, estimates."""

"""Where the points of each kind of board are in a picture. `detectors/boards` chooses among these by the board's kind."""

"""The research interface of a Franka on the wire, for both of its ends."""

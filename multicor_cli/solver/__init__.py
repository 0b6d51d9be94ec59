"""One time step of the mechanics, and the contact solver on its own."""

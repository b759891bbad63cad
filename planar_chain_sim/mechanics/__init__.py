"""A chain at one instant: forces, accelerations, energies, places."""

"""The equations of motion of a chain as terms, to be read, written out and evaluated one by one."""

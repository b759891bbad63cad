# The C++ compiler $COMPILER without optimization: for what is compiled here and not timed.
exec $COMPILER "$@" -O0

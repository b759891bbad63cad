# The C++ compiler $COMPILER without optimization and wide vectors: for what is compiled here and not timed.
exec $COMPILER "$@" -O0 -DPLANAR_CHAIN_NARROW

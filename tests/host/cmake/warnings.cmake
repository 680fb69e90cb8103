# The host's own module of this name.
add_library(host_warnings INTERFACE)
target_compile_options(host_warnings INTERFACE -Wall)

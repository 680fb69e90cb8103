# One interface target that every target of ours links: warnings, and the floating-point promise.
add_library(medulla_warnings INTERFACE)
target_compile_options(medulla_warnings INTERFACE
  -Wall -Wextra -Wconversion -Wshadow -Wno-sign-conversion
  # Contraction to fused multiply-add would make the same source print other bits on another target.
  -ffp-contract=off)
option(MEDULLA_WERROR "Treat warnings as errors" OFF)
if(MEDULLA_WERROR)
  target_compile_options(medulla_warnings INTERFACE -Werror)
endif()

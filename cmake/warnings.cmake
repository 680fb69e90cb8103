# An interface target that every target links: warnings, and reproducible floating point.
add_library(medulla_warnings INTERFACE)
target_compile_options(medulla_warnings INTERFACE
  -Wall -Wextra -Wconversion -Wshadow -Wno-sign-conversion
  # Contraction to fused multiply-add would give different bits on different targets.
  -ffp-contract=off)
option(MEDULLA_WERROR "Treat warnings as errors" OFF)
if(MEDULLA_WERROR)
  target_compile_options(medulla_warnings INTERFACE -Werror)
endif()

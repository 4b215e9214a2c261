# The commit that programs say they are of; written only where it has changed.   cmake -D ROOT=. -D OUT=commit.cpp -P commit.cmake
set(commit unknown)
if(EXISTS ${ROOT}/.git)
  set(ENV{GIT_OPTIONAL_LOCKS} 0)  # nobody who commits meanwhile is disturbed
  execute_process(COMMAND git describe --always --dirty --abbrev=10 --exclude=* WORKING_DIRECTORY ${ROOT}
                  OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()
file(CONFIGURE OUTPUT ${OUT} CONTENT "#include \"wire/pc/commit.hpp\"\nconst char wire::pc::commit[] = \"${commit}\";\n")

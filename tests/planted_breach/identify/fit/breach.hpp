// A wall breached on purpose: house_rules must find it.
#include "identify/search/search.hpp"

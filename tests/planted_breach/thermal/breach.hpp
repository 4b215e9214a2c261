// A wall breached on purpose: house_rules must find it.
#include "firmware/axis.hpp"

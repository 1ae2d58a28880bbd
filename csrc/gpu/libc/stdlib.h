/* What headers of the core use of stdlib.h, for a GPU, on which nothing allocates. */
#pragma once

#include <stddef.h>

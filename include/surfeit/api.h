/* Marks the symbols that the shared library exports. */
#ifndef SURFEIT_API_H
#define SURFEIT_API_H

#define SURFEIT_API __attribute__((visibility("default")))

#endif

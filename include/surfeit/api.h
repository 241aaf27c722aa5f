/* What the shared library shows. */
#ifndef SURFEIT_API_H
#define SURFEIT_API_H

#define SURFEIT_API __attribute__((visibility("default")))

#endif

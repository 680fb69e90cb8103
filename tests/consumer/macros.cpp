// Names that well-known headers define as macros, before ours: windows.h and rpcndr.h, X11, Unreal, Apple's and GNU's.
#define near
#define far
#define small char
#define min(a, b) ((a) < (b) ? (a) : (b))
#define max(a, b) ((a) > (b) ? (a) : (b))
#define interface struct
#define hyper long
#define check(x) ((void)(x))
#define verify(x) ((void)(x))
#define require(x) ((void)(x))
#define IN
#define OUT
#define ERROR 0
#define DIFFERENCE 11
#define DELETE 0x10000
#define CONST const
#define VOID void
#define TRUE 1
#define FALSE 0
#define None 0L
#define Status int
#define Bool int
#define True 1
#define False 0
#define Success 0
#define Always 2
#define Above 0
#define Below 1
#define I 1
#define minor(x) (x)
#define major(x) (x)
#define unix 1
#define linux 1
#define PI 3
#define M_PI 3.14159265358979323846
#define Lobe_ 1
#define assume(x)
#define ensure(x)
#define signals
#define slots
#define emit
#define foreach for
#include "medulla/medulla.hpp"
#include "medulla/models/from_fur.hpp"

int main() { return medulla::default_pack().tables[0] ? 0 : 1; }

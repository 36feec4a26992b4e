// Stands for URP's file of this name in the tests.
#include "UnityCG.cginc"
float4 _ScaledScreenParams;

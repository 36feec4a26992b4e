using UnityEngine;

namespace Gsac
{
    /// <summary>How far splats lie before a camera: depth of a point is dot(Row, point), from Low to High.</summary>
    public struct GsacDepths
    {
        public Vector4 Row;
        public float Low;
        public float High;

        public bool IsLike(GsacDepths other)
        {
            return Low == other.Low && High == other.High && Row.x == other.Row.x && Row.y == other.Row.y && Row.z == other.Row.z && Row.w == other.Row.w;
        }
    }
}

using UnityEngine;

namespace Gsac
{
    /// <summary>What is done to an avatar's picture beyond its own colours and light.</summary>
    public struct GsacFinish
    {
        /// <summary>A material with the shader Gsac/Splats: its render queue, stencil and depth test.</summary>
        public Material Material;

        /// <summary>x y z: factor of the colours, in the project's colour space; w: share of the person that is there.</summary>
        public Vector4 Tint;

        /// <summary>Whether a project with linear colours shows the trained picture.</summary>
        public bool Trained;

        /// <summary>Whether the scene's fog lies over the person.</summary>
        public bool Fog;

        /// <summary>Unity's layer.</summary>
        public int Layer;

        public bool IsLike(GsacFinish other)
        {
            return Material == other.Material && Trained == other.Trained && Fog == other.Fog && Layer == other.Layer && Tint.x == other.Tint.x && Tint.y == other.Tint.y
                && Tint.z == other.Tint.z && Tint.w == other.Tint.w;
        }
    }
}

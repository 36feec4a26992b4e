using UnityEngine;

namespace Gsac
{
    /// <summary>Where a ray meets a person's body.</summary>
    public struct GsacHit
    {
        /// <summary>SMPL-X's name of the joint that moves the place most.</summary>
        public string Joint;

        /// <summary>Number of the face in the file.</summary>
        public int Face;

        /// <summary>Shares of the face's three corners, together 1.</summary>
        public Vector3 Shares;

        /// <summary>In the world, m.</summary>
        public Vector3 Position;

        /// <summary>Of the face, towards where the ray comes from; unit length, in the world.</summary>
        public Vector3 Normal;

        /// <summary>m from the ray's origin.</summary>
        public float Distance;
    }
}

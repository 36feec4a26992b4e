using UnityEngine;

namespace Gsac
{
    /// <summary>The bytes of an imported .gsac file, as the project keeps them.</summary>
    public sealed class GsacAsset : ScriptableObject
    {
        [SerializeField, HideInInspector] byte[] bytes;

        public byte[] Bytes
        {
            get { return bytes; }
            set { bytes = value; }
        }
    }
}
